#pragma once

#include <memory>
#include <string>
#include <vector>

#include "avatar/train/train_ranks.h"
#include "cli/program/command.h"
#include "core/disk/output.h"
#include "core/process.h"

/// Several processes of this program that train one avatar together.
namespace mvstudio::cli {

struct RankArguments {
  int ranks = 1;  ///< processes to start here; 0 in `avatar resume`: as many as before
  int rank = 0, world_size = 1;
  std::string rendezvous;
};
void AddRankOptions(CLI::App* sub, RankArguments& arguments);

/// The other ranks of this machine, which run the same command; those that still run are ended when this goes away.
class RankProcesses {
 public:
  /// Starts `arguments.ranks` - 1 processes that find each other by a file in `folder`; with one rank, or where --rank says
  /// that someone else starts them, none.
  RankProcesses(const RankArguments& arguments, const CommandContext& context, const std::string& folder);

  const avatar::RankPlace& place() const { return place_; }
  bool first() const { return place_.rank == 0; }
  /// Threads for each process of this machine.
  int threads() const { return threads_; }
  /// The connection; null for one process.
  std::shared_ptr<const avatar::Ranks> Join() const;
  /// Waits for them; throws IoError when one did not end well, which ends the rest.
  void Finish();

 private:
  void StartOthers(const std::vector<std::string>& words, int ranks);

  const ProgressSink* progress_;
  std::unique_ptr<ScratchFolder> meeting_;  ///< where they find each other
  avatar::RankPlace place_;
  int threads_;
  Processes others_{ProcessGroup::kShared};  ///< Ctrl-C reaches all ranks
};

}  // namespace mvstudio::cli
