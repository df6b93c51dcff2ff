"""What only this study needs: the paper's seven parameters, its estimators beside ours, forty people, figures."""
