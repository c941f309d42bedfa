#pragma once

#include <string>
#include <string_view>

namespace mvstudio::report {

/// Whether bytes begin as a file of Gaussians in motion does (`player.bin`, docs/formats.md).
bool IsPlayerFile(std::string_view bytes);

/// The file inside a box with a canvas, a button and a slider, which PlayerScript brings to life.
std::string PlayerHtml(std::string_view bytes, const std::string& label);

/// The script of all players of a page: WebGL 2, no library, no network.
std::string_view PlayerScript();

}  // namespace mvstudio::report
