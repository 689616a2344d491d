"""The interactive viewer: its data, server, pages and notebook widget."""
