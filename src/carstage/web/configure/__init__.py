"""Configurations as the page edits them: draft, problems, texts, what the server offers."""
