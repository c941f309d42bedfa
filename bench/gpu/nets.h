#pragma once

#include <string>
#include <vector>

#include "avatar/data/pack.h"
#include "avatar/settings/options.h"

/// The networks that bench_gpu checks and times, and made-up images for them.
namespace mvstudio::avatar {

struct Net {
  std::string name;
  ModelOptions options;
  int size_px = 0;
  int critic_width = 16;  // v2v alone
};

/// One of each method at 32 px, four channels wide: seconds on a CPU.
std::vector<Net> SmallNets();
/// Sizes of the papers at 512 px, and the network that `avatar train` takes by default.
std::vector<Net> FullNets();

/// Stick people, with what the network needs beside their images: bodies in colours that are not the images', references.
AvatarPack PackFor(const Net& net, int64_t count);

}  // namespace mvstudio::avatar
