"""What a scene shows beyond its flight volume: land, water, houses and hills that are seen and never touched."""
