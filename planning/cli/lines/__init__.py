"""What commands print, line by line."""
