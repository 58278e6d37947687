"""The operator's windows: the only place that imports Qt."""

from console.window.singletons import outlive_qt

outlive_qt()
