"""The experiments of the paper's section VII, with the truth that it lacked."""
