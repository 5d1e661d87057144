"""Reading mesh files, one module per format, into what `contents` describes."""
