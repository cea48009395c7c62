"""The paper's twelve cases beside this project's numbers."""
