#pragma once

#include <string>

struct AVFrame;
struct SwsContext;

/// Small helpers shared by the video reader and writer; not part of the module's public face.
namespace mvstudio::dataset::internal {

/// libav's text for an error code.
std::string AvErrorText(int code);

/// Turns off libav's own printing; called before anything else of libav.
void SilenceLibav();

/// Converter between a YUV (or RGB) frame and packed RGB of the same size, exact arithmetic, with the frame's own range, colour
/// matrix and chroma position (BT.709 from 720 lines on and BT.601 below where the stream does not say). Owned by the caller
/// (sws_freeContext); nullptr when the pixel format is not supported.
SwsContext* MakeToRgbConverter(const AVFrame& frame);
/// The opposite direction, to BT.709 limited range, chroma left.
SwsContext* MakeFromRgbConverter(int width, int height, int pixel_format);

}  // namespace mvstudio::dataset::internal
