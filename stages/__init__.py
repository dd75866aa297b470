"""The pipeline's stages, one module or package each: a section of the paper, its maths and its command."""
