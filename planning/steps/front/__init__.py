"""The front: what each number of projectors and cameras gives, of one matrix."""
