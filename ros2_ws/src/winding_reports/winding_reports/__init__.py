"""What a run left behind: its record, its report, and where its time went."""
