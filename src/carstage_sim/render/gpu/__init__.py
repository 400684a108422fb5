"""The ray caster and the shading on a graphics card: WGSL compute through wgpu (extra ``gpu``).

The same scene arrays as on the CPU, and the shading kernels themselves, translated to WGSL.
"""
