"""A worked example of data from outside: two bags as a laboratory's own programs would leave them, and a driver."""
