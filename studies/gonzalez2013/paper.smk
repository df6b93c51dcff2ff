PAPER = []
