"""Tables of whatever make: CSV, workbooks, code pages."""
