#pragma once

#include <string>

struct AVFrame;
struct SwsContext;

/// Helpers shared by the video reader and writer; internal to the module.
namespace mvstudio::dataset::internal {

/// libav's text for an error code.
std::string AvErrorText(int code);

/// Turns off libav's own printing; call before anything else of libav.
void SilenceLibav();

/// Converter between a YUV (or RGB) frame and packed RGB of the same size: exact arithmetic, with the frame's own range,
/// colour matrix and chroma position. If the stream does not state it: BT.709 from 720 lines on and BT.601 below. Owned by
/// the caller (sws_freeContext); nullptr when the pixel format is not supported.
SwsContext* MakeToRgbConverter(const AVFrame& frame);
/// The opposite direction, to BT.709 limited range, chroma left.
SwsContext* MakeFromRgbConverter(int width, int height, int pixel_format);

}  // namespace mvstudio::dataset::internal
