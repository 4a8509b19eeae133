"""What a run says, as the messages, words and attachments of its log, and back from them."""
