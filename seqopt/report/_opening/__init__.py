"""What a page opens with: the step that decides, and one sentence that can be acted on."""
