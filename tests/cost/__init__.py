"""What the worst input costs: drawn by hypothesis, with CPU and memory as the property."""
