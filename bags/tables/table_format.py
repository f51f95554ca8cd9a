"""The kinds of tables that a bag can be exported to."""

from enum import Enum


class TableFormat(Enum):
    """Kind of the files."""

    CSV = "csv"
    PARQUET = "parquet"
    NETCDF = "netcdf"
