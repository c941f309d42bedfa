#pragma once

#include <string>

namespace mvstudio::cli {

/// Columns of the terminal that stdout is: COLUMNS where that is set, else what the terminal says; 0 where there is none, and
/// lines stay whole.
int HelpWidth();

/// Help with lines of at most `width` characters where words allow it; descriptions keep their column. 0: as it is.
std::string WrapHelp(const std::string& help, int width);

}  // namespace mvstudio::cli
