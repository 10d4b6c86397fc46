"""The script language of BehaviorTree.CPP v4: tokens, a Pratt parser, and closures on blackboard slots."""
