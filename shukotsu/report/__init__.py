"""After the hands, the study: one table each of joints, bones, metacarpals, tips and errors."""
