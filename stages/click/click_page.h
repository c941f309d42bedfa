#pragma once

/// The page on which points are clicked: three files that name nothing else.
namespace mvstudio::stages {

const char* ClickPageHtml();    ///< index.html; loads click.css and click.js from beside it
const char* ClickPageStyle();   ///< click.css
const char* ClickPageScript();  ///< click.js; asks for scene.json and image/N.jpg, sends clicks.json and finish

}  // namespace mvstudio::stages
