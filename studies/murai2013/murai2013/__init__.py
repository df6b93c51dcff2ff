"""What only this study needs: its numbers beside the paper's, its portraits and figures."""
