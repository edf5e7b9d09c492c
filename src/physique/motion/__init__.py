"""WHAT is performed: clips from files and the library, on the 22 SMPL joints. No MuJoCo."""
