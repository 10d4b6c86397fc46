"""YAML of strangers: texts, lists and mappings alone."""

from __future__ import annotations

from typing import Any

import yaml


def read_plain_yaml(text: str) -> Any:
    """The document; every scalar is the text that stands there.

    An alias makes a small file a huge value, and a number of many digits takes long: the one is refused, the other is
    never computed.

    Raises:
        yaml.YAMLError: it is none, or has aliases.
    """
    return yaml.load(text, Loader=_PlainLoader)


class _PlainLoader(yaml.BaseLoader):
    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("it has aliases")
        node: yaml.Node | None = super().compose_node(parent, index)
        return node
