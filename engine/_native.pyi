# Arguments that are objects are arrays: whatever has a contiguous buffer, or None.
def instruction_sets() -> list[str]: ...
def advance(
    engine: str,
    sizes: tuple[int, int, int, int, int],
    step_gain: float,
    constants: tuple[object, ...],
    span: tuple[int, int, int, int, int, int],
    rows: tuple[object, ...],
    states: tuple[object, object],
    /,
) -> None: ...
def watch(
    engine: str,
    sizes: tuple[int, ...],
    shapes: tuple[object, ...],
    samples: tuple[object, ...],
    margin: float,
    detector: tuple[object, ...],
    concluded: tuple[object, ...],
    /,
) -> None: ...
def draw(sizes: tuple[int, ...], given: tuple[object, ...], /) -> None: ...
