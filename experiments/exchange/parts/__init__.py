"""What claims about assemblies of others rest on."""
