"""What this machine reaches: Oarlock's filters beside the textbook's and other software."""
