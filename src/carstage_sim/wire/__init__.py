"""CARLA's wire protocol: msgpack-rpc server, streaming server, codec tables.

Bytes in, calls on the world out; one table per protocol version. Nothing here simulates.
"""
