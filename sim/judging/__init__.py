"""Ground truth from black boxes: who touched whom, who arrived, how well plans were followed."""
