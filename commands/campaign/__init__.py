"""What plays a campaign from the command line, shared by both programs."""
