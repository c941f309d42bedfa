#include "calib/formats/format_text.h"

#include <charconv>
#include <cmath>
#include <filesystem>

#include "core/csv.h"
#include "core/error.h"
#include "core/join.h"
#include "core/text/shortest_text.h"

namespace mvstudio::calib::internal {

std::string Printable(std::string_view text) {
  std::string plain(text.substr(0, 40));
  for (char& c : plain) c = c >= ' ' && c <= '~' ? c : '?';
  return plain;
}

double ParseNumber(std::string_view text, const Place& place) {
  const size_t first = text.find_first_not_of(" \t\r\n+"), last = text.find_last_not_of(" \t\r\n");
  if (first != std::string_view::npos) text = text.substr(first, last + 1 - first);
  double number = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (code != std::errc() || end != text.data() + text.size() || !std::isfinite(number)) {
    throw FormatError(place.path, place.where, "'" + Printable(text) + "' is not a finite number" + DecimalCommaHint(text));
  }
  return number;
}

std::string NumberText(double value) {
  std::string text = ShortestText(value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string ListText(const Eigen::VectorXd& vector) { return "[" + Join(vector, ", ", NumberText) + "]"; }

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < ' ') {
      throw UsageError("'" + Printable(text) + "' has a control character in it; use option 'rename' OLD=NEW");
    }
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + "\"";
}

const std::string& FileName(const std::string& name) {
  if (name.empty() || name[0] == '.' || name.find('/') != std::string::npos) {
    throw UsageError("the camera name '" + Printable(name) + "' cannot be a file's name; use option 'rename' OLD=NEW");
  }
  return name;
}

bool HoldsCamerasByName(std::string_view text) {
  const auto has = [&](const char* piece) { return text.find(piece) != std::string_view::npos; };
  return has("\"distCoeff\"") && has("\"imgSize\"") && has("\"K\"");
}

std::string Stem(const std::string& path) { return std::filesystem::path(path).stem().string(); }

}  // namespace mvstudio::calib::internal
