"""What a plan is in other hands: values that show themselves in a notebook."""
