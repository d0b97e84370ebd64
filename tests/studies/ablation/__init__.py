"""Where the spiking adaptive term helps: measured, judged, and written to docs/ablation.md."""
