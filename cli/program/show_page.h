#pragma once

#include <string>

#include "stages/serve/page_server.h"

namespace mvstudio::cli {

/// On 127.0.0.1; where the page is, is said on stderr. `how_it_ends`: "its button Finish". `open`: the browser of the machine
/// is started, too, where there is a display.
stages::ShowPage ShowOn(int port, const std::string& how_it_ends, bool open = false);

}  // namespace mvstudio::cli
