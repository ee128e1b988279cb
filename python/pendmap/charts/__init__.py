"""What is shown of each kind of result, a module a kind, independent of drawing libraries."""
