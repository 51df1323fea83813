"""What projectors show: which of their light carries a code, and its surfaces."""
