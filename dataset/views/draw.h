#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/image.h"

/// Lines, discs, rings and outlines over images, smooth at their edges. A pixel takes the colour by the share of it that is
/// covered, 1 where the distance of its centre from the line is at most half a width less half a pixel. Nothing is drawn for
/// places that are not finite; what leaves the image is cut.
namespace mvstudio::dataset {

struct DrawColour {
  uint8_t r = 255, g = 255, b = 255;
};

/// With round ends. `rgb` has three channels; places in px, (0, 0) is the centre of the top-left pixel.
void DrawSegment(const Eigen::Vector2d& from_px, const Eigen::Vector2d& to_px, double width_px, const DrawColour& colour,
                 Image* rgb);
void DrawDisc(const Eigen::Vector2d& centre_px, double radius_px, const DrawColour& colour, Image* rgb);
void DrawRing(const Eigen::Vector2d& centre_px, double radius_px, double width_px, const DrawColour& colour, Image* rgb);
/// Pixels of the foreground (above 127) beside one of the background. The mask is as large as the image (ContractViolation).
void DrawMaskOutline(const Image& mask, const DrawColour& colour, Image* rgb);

/// `part` with its top-left pixel at (x, y) of `rgb`; both have three channels.
void PasteImage(const Image& part, int x, int y, Image* rgb);

}  // namespace mvstudio::dataset
