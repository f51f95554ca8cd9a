"""Whether the recorded quality of service says that late subscribers got what was published before."""

import yaml

from bags.mcap.yaml_text import load

_LATCHED = (1, "1", "transient_local")  # by number in older bags


def is_latched(profiles: object) -> bool:
    """Whether one of the publishers kept its messages.

    Args:
        profiles: `offered_qos_profiles` as a list, or as YAML of one; anything else says nothing.
    """
    if isinstance(profiles, str):
        try:
            profiles = load(profiles) if profiles else None
        except yaml.YAMLError:
            return False
    if not isinstance(profiles, list):
        return False
    return any(isinstance(one, dict) and one.get("durability") in _LATCHED for one in profiles)
