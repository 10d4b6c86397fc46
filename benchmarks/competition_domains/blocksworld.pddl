; Towers of blocks on a table, one arm that lifts one clear block at a time.
(define (domain blocksworld)
  (:requirements :strips :typing)
  (:types block)
  (:predicates (on ?above ?below - block) (on-table ?block - block) (clear ?block - block)
               (holding ?block - block) (arm-empty))
  (:action pick-up
    :parameters (?block - block)
    :precondition (and (clear ?block) (on-table ?block) (arm-empty))
    :effect (and (holding ?block) (not (on-table ?block)) (not (clear ?block)) (not (arm-empty))))
  (:action put-down
    :parameters (?block - block)
    :precondition (holding ?block)
    :effect (and (on-table ?block) (clear ?block) (arm-empty) (not (holding ?block))))
  (:action stack
    :parameters (?above ?below - block)
    :precondition (and (holding ?above) (clear ?below))
    :effect (and (on ?above ?below) (clear ?above) (arm-empty) (not (holding ?above)) (not (clear ?below))))
  (:action unstack
    :parameters (?above ?below - block)
    :precondition (and (on ?above ?below) (clear ?above) (arm-empty))
    :effect (and (holding ?above) (clear ?below) (not (on ?above ?below)) (not (clear ?above)) (not (arm-empty)))))
