#pragma once

#include "stages/nets/avatar_train_data.h"

namespace CLI {
class App;
}

namespace mvstudio::cli {

/// Which cameras and frames are trained on, and which are held out.
void AddSplitOptions(CLI::App* sub, stages::SplitArguments& arguments);

}  // namespace mvstudio::cli
