"""What draws the guide's pictures: the average hand, its receivers, its movements and the room around it."""
