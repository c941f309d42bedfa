#pragma once

#include <string>
#include <string_view>

namespace mvstudio::report {

std::string Base64(std::string_view bytes);

/// "image/png" or "image/jpeg" by the content's first bytes, empty for anything else.
std::string ImageType(std::string_view bytes);

/// Width and height from a PNG header; false for other content.
bool PngSize(std::string_view bytes, int* width, int* height);

/// The image as a data URI.
std::string ImageUri(std::string_view bytes);

/// An <img> with the image inside it as a data URI.
std::string ImageHtml(std::string_view bytes, const std::string& alt);

}  // namespace mvstudio::report
