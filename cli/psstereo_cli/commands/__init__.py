"""One command a module: options in, a few calls of the library, a table or JSON out."""
