"""A flood: a village street under brown water behind a broken dyke, or a farm on its mound in a drowned polder."""
