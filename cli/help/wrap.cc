#include "cli/help/wrap.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>

namespace mvstudio::cli {
namespace {

constexpr int kLeastWidth = 40;
constexpr size_t kDescriptionAt = 30;  // CLI11's column

/// Code points: each is taken for a column.
size_t WidthOf(const std::string& text) {
  return static_cast<size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) >> 6 != 2; }));
}

/// Where the lines begin that go on with this one: below the description of an option, else below its own beginning.
size_t IndentOf(const std::string& line) {
  const size_t begin = std::min(line.find_first_not_of(' '), line.size());
  const bool option = begin == 2 && line.size() > kDescriptionAt;
  return option ? kDescriptionAt : begin;
}

std::string WrapLine(const std::string& line, size_t width) {
  const size_t indent = IndentOf(line);
  if (WidthOf(line) <= width || indent + 20 > width || line.rfind("Example: ", 0) == 0) return line;
  const std::string margin(indent, ' ');
  std::string out, now = line.substr(0, std::min(line.find_first_not_of(' '), line.size()));
  bool empty = true;  // the line that is being filled, but for its margin
  std::istringstream words(line.substr(now.size()));
  const bool option = now.size() == 2 && indent == kDescriptionAt;
  if (option && line.size() > kDescriptionAt && line[kDescriptionAt - 1] == ' ') {  // names, then their description
    now = line.substr(0, kDescriptionAt);
    words = std::istringstream(line.substr(kDescriptionAt));
  }
  for (std::string word; words >> word;) {
    if (!empty && WidthOf(now) + 1 + WidthOf(word) > width) {
      out += now + "\n";
      now = margin, empty = true;
    }
    now += (empty ? "" : " ") + word;
    empty = false;
  }
  return out + now;
}

}  // namespace

int HelpWidth() {
  const char* columns = std::getenv("COLUMNS");
  int width = columns ? std::atoi(columns) : 0;
  winsize size{};
  if (width <= 0 && isatty(STDOUT_FILENO) && ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0) width = size.ws_col;
  return width <= 0 ? 0 : std::max(width, kLeastWidth);
}

std::string WrapHelp(const std::string& help, int width) {
  if (width <= 0) return help;
  std::string out;
  std::istringstream lines(help);
  for (std::string line; std::getline(lines, line);) out += WrapLine(line, static_cast<size_t>(width)) + "\n";
  return out;
}

}  // namespace mvstudio::cli
