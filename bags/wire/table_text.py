"""The table of messages for people: docs/topics.md."""

from bags.wire.row import Need
from bags.wire.table import TABLE

TOPICS_PAGE = "docs/topics.md"


def table_text() -> str:
    """The table in Markdown, a line each row."""
    lines = ["| topic | type | says | publisher | readers | when |", "|---|---|---|---|---|---|"]
    for row in TABLE:
        readers = ", ".join(f"`{one}`" for one in row.readers)
        when = row.kind.value if row.need is Need.ALWAYS else f"{row.kind.value}, {row.need.value}"
        kind = row.type_name.replace("/msg/", "/")
        lines.append(f"| `{row.name}` | {kind} | {row.says} | `{row.publisher}` | {readers} | {when} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(table_text())  # noqa: T201 - the page is made of it
