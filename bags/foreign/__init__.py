"""Data of other programs: tables, other people's bags and live topics, by field path, on one sampling grid."""
