"""Still pictures of grains, rendered without a browser."""
