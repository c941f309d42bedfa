// Private: for board_text.cc.
#pragma once

#include <string>
#include <string_view>

namespace mvstudio::calib::internal {

/// Whether a board's text is the name of such a file: it ends in .yaml, .yml or .json.
bool NamesTarget(const std::string& text);

/// Throws UsageError where a board's text names a file or folder: footage, given in the wrong place.
void RefuseFile(const std::string& text);

/// The text of the board that a target file of Kalibr (YAML) or Basalt (JSON) describes: aprilgrid, checkerboard, circlegrid.
/// Throws FormatError with the key, IoError.
std::string BoardTextOfTarget(const std::string& path);

/// Whether it is multical's file of boards, which name their `_type_`.
bool IsMulticalBoards(std::string_view text);
/// The text of its only board. Throws FormatError; UsageError for several, with the text of each.
std::string BoardTextOfMultical(const std::string& path, const std::string& text);

}  // namespace mvstudio::calib::internal
