#![no_main]
unscatter_fuzz::target!("checkpoint");
