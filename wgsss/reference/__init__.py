"""The truths that methods and models are measured against."""
