"""What the stages do, one module a stage: imported when a shard is computed, and with it numba, FCL or PyBullet."""
