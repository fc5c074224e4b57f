"""Compresses attachments to files `NAME.zst`, in the format of the program zstd."""

from .records import Attachment

MEDIA_TYPE = "application/zstd"
_SUFFIX = ".zst"
# Largest number of unpacked bytes per packed byte. Meshes have about 3. Without this limit, a file
# of another program could fill the memory.
_MAX_RATIO = 100


def pack(name: str, data: bytes) -> Attachment:
    """Return an attachment that contains a file. The content is compressed if this saves space.

    Args:
        name: Name of the file.
        data: Content of the file.
    """
    from zstandard import ZstdCompressor

    packed = ZstdCompressor().compress(data)
    if len(packed) < len(data) <= _MAX_RATIO * len(packed):
        return Attachment(f"{name}{_SUFFIX}", MEDIA_TYPE, packed)
    return Attachment(name, "application/octet-stream", data)


def unpack(attachment: Attachment) -> tuple[str, bytes]:
    """Return the name and the content of the file in an attachment.

    Raises:
        ValueError: The attachment is compressed, but not by `pack`.
    """
    if attachment.media_type != MEDIA_TYPE:
        return attachment.name, attachment.data
    from zstandard import ZstdDecompressor, ZstdError, get_frame_parameters

    name, data = attachment.name.removesuffix(_SUFFIX), attachment.data
    try:
        # The library would allocate the claimed size of the frame, even above the limit.
        size, most = get_frame_parameters(data).content_size, _MAX_RATIO * len(data)
        if size > most:
            raise ValueError(f"{name} unpacks from {len(data)} to {size} bytes; limit {most} bytes")
        return name, ZstdDecompressor().decompress(data)
    except ZstdError as error:
        raise ValueError(f"{name} cannot be unpacked: {error}") from error
