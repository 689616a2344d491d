"""Reference numbers of tests, and the scripts that computed them."""
